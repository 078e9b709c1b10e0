defmodule Console.Page.Access do
  @moduledoc """
  Decides who may look at the page and command by it. Pure.

  A browser that shows a page of strangers may be made to call this one. It says then where it comes from (`Origin`), and
  by which name it was sent here (`Host`): a name that somebody else has given an address of this machine is not taken.
  On the loopback that is all; elsewhere a token is demanded, once in the address, then in a cookie.

  Behind a proxy browsers know the page by the proxy's address, its `origin`. The proxy may pass on their `Host` or say its own.
  """

  @type request :: %{
          host: String.t() | nil,
          origin: String.t() | nil,
          token: String.t() | nil
        }

  @doc "Whether only this machine reaches the address."
  @spec loopback?(:inet.ip_address()) :: boolean()
  def loopback?({127, _, _, _}), do: true
  def loopback?({0, 0, 0, 0, 0, 0, 0, 1}), do: true
  def loopback?(_address), do: false

  @doc """
  `:ok`, or the status and the line of a refusal. `token` is the page's, `origin` that of its proxy; `nil` for none.

      iex> at_home = %{host: "localhost:4000", origin: "http://localhost:4000", token: nil}
      iex> Console.Page.Access.check(at_home, nil, nil)
      :ok
      iex> Console.Page.Access.check(%{at_home | origin: "http://elsewhere.example"}, nil, nil)
      {403, "pages of http://elsewhere.example may not use this one; if that is this page behind a proxy: --page-origin http://elsewhere.example"}
      iex> Console.Page.Access.check(%{at_home | host: "rebound.example:4000", origin: nil}, nil, nil)
      {403, "this page is not rebound.example: use an address, or localhost; if that is its proxy: --page-origin https://rebound.example"}
      iex> Console.Page.Access.check(at_home, "secret", nil)
      {401, "a token is needed: open the page with ?token=…"}
      iex> Console.Page.Access.check(%{at_home | token: "secret"}, "secret", nil)
      :ok
      iex> proxied = %{host: "robots.lab.example", origin: "https://robots.lab.example", token: nil}
      iex> for request <- [proxied, %{proxied | host: "127.0.0.1:4000"}, %{proxied | origin: nil}],
      ...>     do: Console.Page.Access.check(request, nil, "https://robots.lab.example")
      [:ok, :ok, :ok]
  """
  @spec check(request(), String.t() | nil, String.t() | nil) :: :ok | {400..499, String.t()}
  def check(%{host: host, origin: from, token: given}, token, origin) do
    cond do
      host == nil ->
        {400, "a request without Host"}

      not here?(name(host)) and not proxy?(host, origin) ->
        {403,
         "this page is not #{name(host)}: use an address, or localhost; if that is its proxy: --page-origin https://#{name(host)}"}

      from not in [nil, "http://" <> host, origin] ->
        {403,
         "pages of #{from} may not use this one; if that is this page behind a proxy: --page-origin #{from}"}

      token != nil and not same?(given, token) ->
        {401, "a token is needed: open the page with ?token=…"}

      true ->
        :ok
    end
  end

  @doc "Whether the request came by the name of the proxy, whose `origin` this is."
  @spec proxy?(host :: String.t(), String.t() | nil) :: boolean()
  def proxy?(_host, nil), do: false
  def proxy?(host, origin), do: String.downcase(name(host)) == URI.parse(origin).host

  # A name server can give any name any address, but no address another.
  defp here?("localhost"), do: true
  defp here?(name), do: match?({:ok, _ip}, :inet.parse_strict_address(String.to_charlist(name)))

  defp name("[" <> rest), do: rest |> String.split("]") |> hd()
  defp name(host), do: host |> String.split(":") |> hd()

  # Takes as long for each wrong token.
  defp same?(nil, _token), do: false
  defp same?(given, token), do: :crypto.hash(:sha256, given) == :crypto.hash(:sha256, token)
end
